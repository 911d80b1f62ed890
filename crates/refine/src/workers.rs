//! Frames in parallel.

use std::collections::BTreeMap;
use std::convert::Infallible;
use std::sync::atomic::{AtomicUsize, Ordering};
use std::sync::mpsc;

use rayon::{ThreadPool, ThreadPoolBuildError, ThreadPoolBuilder};

use crate::error::RefineError;

/// Main threads have as much; Rayon's own default is a quarter of it.
const STACK_BYTES: usize = 8 << 20;

/// Thread pools that each process whole frames.
///
/// There is one pool per thread; with fewer frames than threads, the threads are divided among as many pools as frames.
/// Results do not depend on the number of threads.
#[derive(Debug)]
pub struct Workers {
    pools: Vec<ThreadPool>,
}

impl Workers {
    /// Workers for `frames` frames with `threads` threads in total.
    ///
    /// # Errors
    /// [`RefineError::Setting`] if the system gives no threads.
    pub fn new(frames: usize, threads: usize) -> Result<Self, RefineError> {
        let threads = threads.max(1);
        let workers = threads.min(frames).max(1);
        let pool = |worker: usize| {
            let own = threads / workers + usize::from(worker < threads % workers);
            ThreadPoolBuilder::new().num_threads(own).stack_size(STACK_BYTES).build()
        };
        let refused = |error: ThreadPoolBuildError| RefineError::Setting {
            name: "threads",
            problem: format!("cannot be had: {error}"),
        };
        let pools = (0..workers).map(pool).collect::<Result<_, _>>().map_err(refused)?;
        Ok(Self { pools })
    }

    /// Does all `jobs`, each by one of the workers that `worker` makes, and hands results to `done` on this thread as they
    /// come, in no particular order. Once `done` fails, no further job is begun.
    ///
    /// # Errors
    /// The first error that `done` returns.
    pub fn run<J, T, E, W>(
        &self,
        jobs: &[J],
        worker: impl Fn() -> W + Sync,
        mut done: impl FnMut(&J, T) -> Result<(), E>,
    ) -> Result<(), E>
    where
        J: Sync,
        T: Send,
        W: FnMut(&J) -> T,
    {
        let next = AtomicUsize::new(0);
        std::thread::scope(|scope| {
            let (sender, results) = mpsc::channel();
            for pool in &self.pools {
                let (sender, next, worker) = (sender.clone(), &next, &worker);
                scope.spawn(move || {
                    pool.install(move || {
                        let mut work = worker();
                        while let Some(job) = jobs.get(next.fetch_add(1, Ordering::Relaxed)) {
                            // Nobody listens once `done` has failed.
                            if sender.send((job, work(job))).is_err() {
                                break;
                            }
                        }
                    });
                });
            }
            drop(sender);
            results.into_iter().try_for_each(|(job, result)| done(job, result))
        })
    }

    /// Does the `work` of all `indices` side by side; `each` hears of them in their order, so that sums are the same for any number of threads.
    pub fn run_in_order<T: Send>(
        &self,
        indices: &[usize],
        work: impl Fn(usize) -> T + Sync,
        mut each: impl FnMut(usize, T),
    ) {
        let (mut waiting, mut next) = (BTreeMap::new(), 0);
        let places: Vec<usize> = (0..indices.len()).collect();
        let Ok(()) = self.run(
            &places,
            || |&at: &usize| work(indices[at]),
            |&at, outcome| -> Result<(), Infallible> {
                waiting.insert(at, outcome);
                while let Some(outcome) = waiting.remove(&next) {
                    each(indices[next], outcome);
                    next += 1;
                }
                Ok(())
            },
        );
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_job_is_done_once_and_threads_are_shared_out() {
        for (frames, threads, expected) in [(5, 2, vec![1, 1]), (2, 5, vec![3, 2]), (0, 1, vec![1])]
        {
            let workers = Workers::new(frames, threads).unwrap();
            let own: Vec<usize> =
                workers.pools.iter().map(ThreadPool::current_num_threads).collect();
            assert_eq!(own, expected);
            let jobs: Vec<usize> = (0..frames).collect();
            let mut sum = vec![0; frames];
            let done = |&job: &usize, result: usize| {
                assert_eq!(result, job * job);
                sum[job] += 1;
                Ok::<(), ()>(())
            };
            workers.run(&jobs, || |&job: &usize| job * job, done).unwrap();
            assert_eq!(sum, vec![1; frames]);
        }
    }

    #[test]
    fn results_come_in_order() {
        let indices: Vec<usize> = (3..40).collect();
        let mut heard = Vec::new();
        let workers = Workers::new(indices.len(), 3).unwrap();
        workers.run_in_order(&indices, |k| k * k, |k, square| heard.push((k, square)));
        assert_eq!(heard, indices.iter().map(|k| (*k, k * k)).collect::<Vec<_>>());
    }

    #[test]
    fn a_failure_ends_the_run() {
        let jobs: Vec<usize> = (0..1000).collect();
        let mut count = 0;
        let ended = Workers::new(1, 1).unwrap().run(
            &jobs,
            || |&job: &usize| job,
            |_, job| {
                count += 1;
                if job == 3 { Err("full") } else { Ok(()) }
            },
        );
        assert_eq!((ended, count), (Err("full"), 4));
    }
}
