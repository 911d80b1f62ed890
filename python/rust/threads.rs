//! Work without Python's lock, on threads of this process.

use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::mpsc::{RecvTimeoutError, channel};
use std::sync::{Arc, Mutex, PoisonError};
use std::time::Duration;

use pyo3::prelude::*;
use rayon::{ThreadPool, ThreadPoolBuilder};

use crate::error::{Raise, wrong};

/// The threads, and the process that they belong to.
static POOL: Mutex<Option<(u32, Arc<ThreadPool>)>> = Mutex::new(None);

/// True while work is to end early.
static INTERRUPTED: AtomicBool = AtomicBool::new(false);

/// Interval at which Python is asked for signals.
const LOOK: Duration = Duration::from_millis(50);

/// True once Python was interrupted, until the work has ended.
pub(crate) fn is_interrupted() -> bool {
    INTERRUPTED.load(Ordering::Relaxed)
}

/// Runs `work` on as many threads as there are cores, while Python's other threads run on. Ctrl-C raises as soon as it has ended, which
/// [`is_interrupted`] makes soon.
///
/// Not on rayon's own threads: a process that Python has forked, as its `multiprocessing` does, has none of the threads of its parent, and would wait for
/// them for ever.
pub(crate) fn detached<T: Send>(py: Python<'_>, work: impl FnOnce() -> T + Send) -> PyResult<T> {
    let pool = pool()?;
    py.detach(|| {
        let (sender, receiver) = channel();
        let outcome = pool.in_place_scope(|scope| {
            scope.spawn(move |_| drop(sender.send(work())));
            let mut interrupted = None;
            loop {
                match receiver.recv_timeout(LOOK) {
                    Ok(result) => return interrupted.map_or(Ok(result), Err),
                    // The scope goes on with its panic.
                    Err(RecvTimeoutError::Disconnected) => return Err(wrong("no result")),
                    Err(RecvTimeoutError::Timeout) if interrupted.is_none() => {
                        interrupted = Python::attach(|py| py.check_signals()).err();
                        INTERRUPTED.store(interrupted.is_some(), Ordering::Relaxed);
                    }
                    Err(RecvTimeoutError::Timeout) => {}
                }
            }
        });
        if outcome.is_err() {
            INTERRUPTED.store(false, Ordering::Relaxed);
        }
        outcome
    })
}

fn pool() -> PyResult<Arc<ThreadPool>> {
    let own = std::process::id();
    let mut pool = POOL.lock().unwrap_or_else(PoisonError::into_inner);
    match &*pool {
        Some((process, threads)) if *process == own => Ok(Arc::clone(threads)),
        _ => {
            let threads = Arc::new(ThreadPoolBuilder::new().build().raise()?);
            // That of a parent is not waited for.
            std::mem::forget(pool.replace((own, Arc::clone(&threads))));
            Ok(threads)
        }
    }
}
