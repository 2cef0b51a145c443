//! Which random numbers a pass has.

use crate::hash::hash;
use crate::sequence::Sequence;

/// Purpose of the random numbers that are the passes' seeds.
const PASS: u32 = 0x5041_5353;

/// One of many pictures of the same expectation.
///
/// Passes take turns in [`Self::STREAMS`] streams. Those of a stream spread their numbers evenly together; streams have nothing in common, so that their
/// means tell the error of the whole.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Pass {
    /// Of the numbers that are its own.
    pub seed: u32,
    /// Where it is among those of its stream.
    pub sequence: Sequence,
}

impl Pass {
    /// Streams of passes. More of them know their error better, fewer have less of it.
    pub const STREAMS: u32 = 4;

    /// A pass of a picture, counted from 0; the first has the picture's own seed.
    #[must_use]
    pub fn of(seed: u32, number: u32) -> Self {
        let stream = Self::seed_of_stream(seed, number % Self::STREAMS);
        let own = if number < Self::STREAMS { stream } else { hash(&[PASS, seed, number]) };
        Self { seed: own, sequence: Sequence { seed: stream, place: number / Self::STREAMS } }
    }

    /// The seed of a stream; the first has the picture's own.
    #[must_use]
    pub fn seed_of_stream(seed: u32, stream: u32) -> u32 {
        if stream == 0 { seed } else { hash(&[PASS, seed, stream]) }
    }

    /// One that shares nothing with passes of other seeds.
    #[must_use]
    pub fn alone(seed: u32) -> Self {
        Self { seed, sequence: Sequence::start(seed) }
    }
}

/// What names the random numbers of a point: those that are its own in each pass, and those that passes spread evenly.
#[derive(Clone, Copy, Debug)]
pub struct PointKey {
    pub own: u32,
    pub sequence: Sequence,
}

impl PointKey {
    /// One that is told from others of the same point by a purpose and a number.
    #[must_use]
    pub fn part(self, purpose: u32, number: u32) -> Self {
        let part = |key| hash(&[purpose, key, number]);
        Self { own: part(self.own), sequence: Sequence { seed: part(self.sequence.seed), ..self.sequence } }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_first_pass_is_the_picture_and_streams_take_turns() {
        assert_eq!(Pass::of(7, 0), Pass::alone(7));
        let passes: Vec<Pass> = (0..12).map(|number| Pass::of(7, number)).collect();
        for (number, pass) in passes.iter().enumerate() {
            assert_eq!(pass.sequence.seed, passes[number % 4].sequence.seed);
            assert_eq!(pass.sequence.place as usize, number / 4);
            assert!(passes[..number].iter().all(|before| before.seed != pass.seed), "each has numbers of its own");
        }
    }
}
