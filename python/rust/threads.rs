//! Threads for batches.

use std::sync::{Arc, Mutex, PoisonError};

use pyo3::prelude::*;
use rayon::{ThreadPool, ThreadPoolBuilder};

use crate::error::Raise;

/// The threads, and the process that they belong to.
static POOL: Mutex<Option<(u32, Arc<ThreadPool>)>> = Mutex::new(None);

/// Runs `work` on as many threads as there are cores.
///
/// Not on rayon's own: a process that Python has forked, as its `multiprocessing` does, has none of the threads of its parent, and would wait for them for ever.
pub(crate) fn run<T: Send>(work: impl FnOnce() -> T + Send) -> PyResult<T> {
    let own = std::process::id();
    let pool = {
        let mut pool = POOL.lock().unwrap_or_else(PoisonError::into_inner);
        match &*pool {
            Some((process, threads)) if *process == own => Arc::clone(threads),
            _ => {
                let threads = Arc::new(ThreadPoolBuilder::new().build().raise()?);
                // That of a parent is not waited for.
                std::mem::forget(pool.replace((own, Arc::clone(&threads))));
                threads
            }
        }
    };
    Ok(pool.install(work))
}
