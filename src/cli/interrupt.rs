//! Ctrl-C: the first asks the work to stop, the second ends the program at once.

use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Arc, OnceLock};

use signal_hook::consts::{SIGINT, SIGTERM, SIGXFSZ};
use signal_hook::flag;

/// The exit code of an interrupted program: 128 and the number of SIGINT.
const CODE: i32 = 130;

fn flag() -> &'static Arc<AtomicBool> {
    static FLAG: OnceLock<Arc<AtomicBool>> = OnceLock::new();
    FLAG.get_or_init(Arc::default)
}

/// Catches SIGINT and SIGTERM from now on; call it before work that asks [`requested`].
///
/// # Errors
/// The system's, when it does not let the signals be caught.
pub fn install() -> std::io::Result<()> {
    static INSTALLED: OnceLock<()> = OnceLock::new();
    if INSTALLED.set(()).is_ok() {
        // Without anybody who catches it, a file larger than the shell's limit ends the program; so the write fails, with a message.
        flag::register(SIGXFSZ, Arc::default())?;
        for signal in [SIGINT, SIGTERM] {
            // In this order: the flag is still down when the first signal passes the shutdown.
            flag::register_conditional_shutdown(signal, CODE, Arc::clone(flag()))?;
            flag::register(signal, Arc::clone(flag()))?;
        }
    }
    Ok(())
}

/// Whether the user has asked the program to stop.
pub fn requested() -> bool {
    flag().load(Ordering::Relaxed)
}
