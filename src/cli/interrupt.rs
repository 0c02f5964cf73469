//! Ctrl+C: the first interrupt requests the end of the work that watches for it, the second one ends the process.

use std::ops::ControlFlow;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Arc, Mutex, PoisonError};

use anyhow::{Context as _, Result};
use signal_hook::consts::{SIGINT, SIGTERM};
use signal_hook::flag;

use crate::cli::exit::INTERRUPTED;

/// Flags of the process; handlers are registered once.
static SIGNALS: Mutex<Option<Signals>> = Mutex::new(None);

#[derive(Clone, Debug)]
struct Signals {
    interrupted: Arc<AtomicBool>,
    /// True while no work watches for signals, so that one ends the process as if there were no handler.
    released: Arc<AtomicBool>,
}

impl Signals {
    fn register() -> Result<Self> {
        let (interrupted, released) = (Arc::new(AtomicBool::new(false)), Arc::new(AtomicBool::new(false)));
        for signal in [SIGINT, SIGTERM] {
            // The order of registration matters: at the first signal, `interrupted` is still unset here.
            flag::register_conditional_default(signal, Arc::clone(&released))
                .and_then(|_| {
                    flag::register_conditional_shutdown(signal, i32::from(INTERRUPTED), Arc::clone(&interrupted))
                })
                .and_then(|_| flag::register(signal, Arc::clone(&interrupted)))
                .context("cannot watch for Ctrl+C")?;
        }
        Ok(Self { interrupted, released })
    }
}

/// Set by the first signal.
#[derive(Clone, Debug)]
pub(crate) struct Interrupt(Signals);

impl Interrupt {
    /// From now on the first interrupt (or request to terminate) sets the flag, and the second one ends the process at
    /// once; without this call, and after [`Self::release`], the first one ends it. A flag set for earlier work of the
    /// process stays set.
    pub(crate) fn watch() -> Result<Self> {
        let mut registered = SIGNALS.lock().unwrap_or_else(PoisonError::into_inner);
        let signals = match &*registered {
            Some(signals) => signals.clone(),
            None => registered.insert(Signals::register()?).clone(),
        };
        signals.released.store(false, Ordering::SeqCst);
        Ok(Self(signals))
    }

    /// Ends the watch: the next interrupt ends the process at once, until the next [`Self::watch`].
    pub(crate) fn release(self) {
        self.0.released.store(true, Ordering::SeqCst);
    }

    pub(crate) fn flag(&self) -> Arc<AtomicBool> {
        Arc::clone(&self.0.interrupted)
    }

    /// Continue or break, for callbacks.
    pub(crate) fn control_flow(&self) -> ControlFlow<()> {
        if self.is_set() { ControlFlow::Break(()) } else { ControlFlow::Continue(()) }
    }

    /// True after a signal.
    pub(crate) fn is_set(&self) -> bool {
        self.0.interrupted.load(Ordering::Relaxed)
    }
}
