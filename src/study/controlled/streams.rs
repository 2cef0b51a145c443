//! Photons of the streams of passes.

use std::collections::VecDeque;

use crate::render::progress::Progress;
use crate::render::{Pass, Photons, Prepared, RenderError};

/// Below this error each stream of passes has photons of its own, so that theirs is an error that streams tell and halve: 400,000 photons alone make the
/// Cornell box .6 % wrong.
const OWN_PHOTONS: f64 = 0.01;

/// Photons that are not in use, those of the stream whose turn is next first.
#[derive(Debug, Default)]
pub(super) struct Streams {
    waiting: VecDeque<Photons>,
    own: bool,
}

impl Streams {
    /// For an error, if one is asked for.
    pub fn new(error: Option<f64>) -> Self {
        Self { waiting: VecDeque::new(), own: error.is_some_and(|error| error < OWN_PHOTONS) }
    }

    /// How many sets of photons passes take turns with.
    pub fn count(&self) -> usize {
        if self.own { Pass::STREAMS as usize } else { 1 }
    }

    /// Those of the first stream, out of what waits; none if they have not been traced yet.
    pub fn first(&mut self) -> Option<Photons> {
        self.waiting.pop_front()
    }

    /// Gives a scene the photons of the stream of pass `number`; passes have come one by one, from 0 on. `seed` is the picture's.
    pub fn turn(
        &mut self,
        prepared: &mut Prepared<'_>,
        seed: u32,
        number: u32,
        progress: &dyn Progress,
    ) -> Result<(), RenderError> {
        if !self.own || number == 0 {
            return Ok(());
        }
        // Until all of them wait or are in use, the next ones have to be traced.
        let next = if self.waiting.len() + 1 < self.count() { None } else { self.waiting.pop_front() };
        let stream = Pass::seed_of_stream(seed, number % Pass::STREAMS);
        self.waiting.extend(prepared.exchange_photons(next, stream, progress)?);
        Ok(())
    }

    /// Takes them back after so many passes.
    pub fn end(
        &mut self,
        mut prepared: Prepared<'_>,
        seed: u32,
        passes: u32,
        progress: &dyn Progress,
    ) -> Result<(), RenderError> {
        for number in passes..passes.next_multiple_of(self.count() as u32) {
            self.turn(&mut prepared, seed, number, progress)?;
        }
        // Of whole rounds the last stream is in use: one more makes it the first.
        if passes > 0 {
            self.turn(&mut prepared, seed, self.count() as u32, progress)?;
        }
        self.put_first(prepared.into_photons());
        Ok(())
    }

    /// Puts back what [`Self::first`] gave.
    pub fn put_first(&mut self, photons: Photons) {
        self.waiting.push_front(photons);
    }
}
