//! Pools of threads, kept between calls and made anew after a fork.

use std::sync::{Arc, Mutex};

use pyo3::exceptions::PyRuntimeError;
use pyo3::prelude::*;
use rayon::{ThreadPool, ThreadPoolBuilder};

struct Kept {
    process: u32,
    threads: usize,
    pool: Arc<ThreadPool>,
}

static KEPT: Mutex<Option<Kept>> = Mutex::new(None);

/// A pool of so many threads (0: all cores).
pub(crate) fn pool(threads: usize) -> PyResult<Arc<ThreadPool>> {
    let process = std::process::id();
    // A child forked while another thread held the lock must not wait for it: it makes its own pool.
    let mut kept = KEPT.try_lock().ok();
    if let Some(Some(k)) = kept.as_deref()
        && k.process == process
        && k.threads == threads
    {
        return Ok(Arc::clone(&k.pool));
    }
    let pool = ThreadPoolBuilder::new()
        .num_threads(threads)
        .build()
        .map_err(|e| PyRuntimeError::new_err(format!("threads: cannot be started: {e}")))?;
    let pool = Arc::new(pool);
    if let Some(kept) = kept.as_mut() {
        let previous = kept.replace(Kept { process, threads, pool: Arc::clone(&pool) });
        if let Some(previous) = previous.filter(|p| p.process != process) {
            // The threads of a forked parent do not exist here: waiting for them to end would never return.
            std::mem::forget(previous.pool);
        }
    }
    Ok(pool)
}
