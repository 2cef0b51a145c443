//! CPU time: what threads really computed, whatever else the machine did meanwhile.

use std::time::Duration;

use nix::time::{ClockId, clock_gettime};

/// CPU time of this process so far, of all threads, in user and system mode; zero where the system does not say.
#[must_use]
pub fn process() -> Duration {
    read(ClockId::CLOCK_PROCESS_CPUTIME_ID)
}

/// CPU time of this thread so far. A call into the system (some tenths of a microsecond): for tiles, not for points.
#[must_use]
pub fn thread() -> Duration {
    read(ClockId::CLOCK_THREAD_CPUTIME_ID)
}

fn read(clock: ClockId) -> Duration {
    clock_gettime(clock).map_or(Duration::ZERO, Duration::from)
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::time::Instant;

    #[test]
    fn sleep_costs_nothing_and_work_does() {
        let (begin, before) = (Instant::now(), thread());
        std::thread::sleep(Duration::from_millis(50));
        let asleep = thread() - before;
        assert!(asleep < Duration::from_millis(20), "{asleep:?}");
        let before = thread();
        let mut x = 1_u64;
        while thread() - before < Duration::from_millis(20) {
            x = std::hint::black_box(x.wrapping_mul(3));
        }
        assert!(begin.elapsed() >= Duration::from_millis(70), "a thread cannot compute for longer than time goes by");
        assert!(process() >= thread());
    }
}
