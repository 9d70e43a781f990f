//! `Estimator`: what is the same for many calls, and the calls, with the GIL released.

use std::sync::atomic::{AtomicBool, Ordering::Relaxed};
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use std::time::{Duration, Instant};

use numpy::{PyArray2, PyReadonlyArray1};
use pyo3::prelude::*;
use pyo3::sync::MutexExt;
use pyo3::types::PyDict;
use rayon::ThreadPool;

use super::again::is_compact;
use super::arrays::flat;
use super::classes::{PyView, to_matrix};
use super::given::Given;
use super::models::PyModels;
use super::observe::Inputs;
use super::options::PyOptions;
use super::outputs::{Outputs, Size};
use super::threads::pool;
use crate::estimate::answers::{Answers, Objects, Places};
use crate::estimate::batch::{Batch, OBJECTS_PER_TASK};
use crate::estimate::estimator::Estimator;
use crate::estimate::frame_tilt::FrameTilt;
use crate::estimate::queue::{Pace, Queue};
use crate::estimate::workspace::{GrowingWorkspace, Workspaces};
use crate::geometry::view::View;

/// Time between two looks for an interrupt; an object takes microseconds, the slowest milliseconds.
const LOOK: Duration = Duration::from_millis(50);

#[pyclass(frozen, name = "Estimator", module = "groundpose._core")]
pub(crate) struct PyEstimator {
    view: View,
    models: Py<PyModels>,
    estimator: Estimator,
    thresholds: Option<Vec<f64>>,
    threads: usize,
    frame_tilt_sigma: Option<f64>,
    workspaces: Workspaces,
}

/// Poses of a batch.
#[pyclass(frozen, name = "Answers", module = "groundpose._core")]
pub(crate) struct PyAnswers {
    outputs: Mutex<Outputs>,
    size: Size,
    tilt: Option<FrameTilt>,
    estimator: Py<PyEstimator>,
    /// As they were given, where something is still to be made from them.
    scores: Option<Vec<f64>>,
    model_indices: Option<Vec<i64>>,
}

/// Pitch, roll and their covariance.
type Tilt<'py> = (f64, f64, Bound<'py, PyArray2<f64>>);

#[pymethods]
impl PyEstimator {
    #[new]
    #[pyo3(signature = (view, models, options, inlier_thresholds=None, threads=0, frame_tilt_sigma=None))]
    fn new(
        view: &PyView,
        models: Py<PyModels>,
        options: &PyOptions,
        inlier_thresholds: Option<PyReadonlyArray1<'_, f64>>,
        threads: usize,
        frame_tilt_sigma: Option<f64>,
    ) -> PyResult<Self> {
        let thresholds = inlier_thresholds.as_ref().map(|t| flat("inlier_threshold", t)).transpose()?;
        Ok(Self {
            view: view.0,
            models,
            estimator: Estimator::new(options.0)?,
            thresholds: thresholds.map(<[f64]>::to_vec),
            threads,
            frame_tilt_sigma,
            workspaces: Workspaces::default(),
        })
    }

    /// The poses of a batch; `None` when something that was given cannot be read as it is, or does not fit. With
    /// `frame_tilt_sigma` the frame's tilt is estimated first, from all objects.
    #[pyo3(signature = (keypoints_2d, bboxes=None, keypoint_scores=None, model_indices=None, vehicle_probability=None,
                        viewing_angle_probabilities=None))]
    fn estimate(
        slf: &Bound<'_, Self>,
        keypoints_2d: &Bound<'_, PyAny>,
        bboxes: Option<&Bound<'_, PyAny>>,
        keypoint_scores: Option<&Bound<'_, PyAny>>,
        model_indices: Option<&Bound<'_, PyAny>>,
        vehicle_probability: Option<&Bound<'_, PyAny>>,
        viewing_angle_probabilities: Option<&Bound<'_, PyAny>>,
    ) -> PyResult<Option<PyAnswers>> {
        let (py, this) = (slf.py(), slf.get());
        let rest = (bboxes, keypoint_scores, model_indices, vehicle_probability, viewing_angle_probabilities);
        let Some(given) = Given::new(keypoints_2d, rest) else { return Ok(None) };
        let models = this.models.get();
        let Some(inputs) = given.inputs(models, this.thresholds.as_deref()) else { return Ok(None) };
        let (objects, keypoints, modes) = (given.objects, inputs.keypoints, models.modes);
        let size = Size { objects, keypoints, modes, is_compact: is_compact(objects, keypoints, &this.view) };
        let tilt_sigma = this.frame_tilt_sigma.unwrap_or(f64::NAN);
        let mut outputs = Outputs::new(py, size, inputs.keypoints_2d, tilt_sigma);
        let scores = inputs.scores.filter(|_| size.is_compact).map(<[f64]>::to_vec);
        let tilt = {
            let mut writing = outputs.writing(py)?;
            this.run(py, &inputs, objects, writing.rows()?)?
        };
        let model_indices = inputs.model_of.numbers().map(<[i64]>::to_vec);
        let (estimator, outputs) = (slf.clone().unbind(), Mutex::new(outputs));
        Ok(Some(PyAnswers { outputs, size, tilt, estimator, scores, model_indices }))
    }
}

impl PyEstimator {
    /// One thread is the caller's own: no pool, no hand-over.
    fn pool(&self, objects: usize) -> PyResult<Option<Arc<ThreadPool>>> {
        if self.threads == 1 || objects <= OBJECTS_PER_TASK { Ok(None) } else { pool(self.threads).map(Some) }
    }

    fn run(
        &self,
        py: Python<'_>,
        inputs: &Inputs,
        objects: usize,
        rows: super::outputs::Rows,
    ) -> PyResult<Option<FrameTilt>> {
        let pool = self.pool(objects)?;
        let pool = pool.as_deref();
        let Some(sigma) = self.frame_tilt_sigma else {
            self.all(py, &self.estimator.batch(&self.view, inputs)?, pool, rows)?;
            return Ok(None);
        };
        let frame = self.estimator.frame_tilt(&self.view, objects, sigma, |free, axes| {
            self.all(py, &free.batch(&self.view, inputs)?, pool, axes)
        })?;
        self.all(py, &self.estimator.batch(&frame.view, inputs)?, pool, rows)?;
        Ok(Some(frame))
    }

    /// All answers.
    fn all<A: Answers>(
        &self,
        py: Python<'_>,
        batch: &Batch<Inputs>,
        pool: Option<&ThreadPool>,
        answers: A,
    ) -> PyResult<()>
    where
        for<'a> Inputs<'a>: Objects<A>,
    {
        self.spread(py, pool, answers, |workspace, first, answers, go_on| {
            batch.on_this_thread(workspace, first, answers, go_on);
        })
    }

    /// Work on all objects, whose numbers begin with that of the first, with the GIL released but for looks for an
    /// interrupt.
    fn spread<A: Places>(
        &self,
        py: Python<'_>,
        pool: Option<&ThreadPool>,
        places: A,
        work: impl Fn(&mut GrowingWorkspace, usize, A, &mut dyn FnMut() -> bool) + Sync + Send,
    ) -> PyResult<()> {
        py.check_signals()?;
        py.detach(|| {
            let (mut last, mut found) = (Instant::now(), Ok(()));
            let mut look = || {
                if last.elapsed() >= LOOK {
                    found = Python::attach(|py| py.check_signals());
                    last = Instant::now();
                }
                found.is_ok()
            };
            match pool {
                None => self.workspaces.lend(|workspace| work(workspace, 0, places, &mut look)),
                Some(pool) => self.on_pool(pool, places, work, look),
            }
            found
        })
    }

    /// On this thread, which looks whether to go on, and on the others of a pool, which stop when it does.
    fn on_pool<A: Places>(
        &self,
        pool: &ThreadPool,
        places: A,
        work: impl Fn(&mut GrowingWorkspace, usize, A, &mut dyn FnMut() -> bool) + Sync + Send,
        mut look: impl FnMut() -> bool,
    ) {
        let stopped = AtomicBool::new(false);
        let threads = pool.current_num_threads();
        let queue = Queue::new(0, places, threads);
        let work = |go_on: &mut dyn FnMut() -> bool| {
            self.workspaces.lend(|workspace| {
                let mut pace = Pace::new();
                while let Some((first, places)) = queue.take(&mut pace) {
                    work(workspace, first, places, go_on);
                }
            });
        };
        pool.in_place_scope(|scope| {
            (1..threads).for_each(|_| scope.spawn(|_| work(&mut || !stopped.load(Relaxed))));
            work(&mut || {
                let go_on = look();
                stopped.store(!go_on, Relaxed);
                go_on
            });
        });
    }
}

#[pymethods]
impl PyAnswers {
    fn __len__(&self) -> usize {
        self.size.objects
    }

    /// Largest number of modes of a model.
    #[getter]
    fn modes(&self) -> usize {
        self.size.modes
    }

    /// Pitch and roll of the frame's view, and their covariance, where they were estimated.
    #[getter]
    fn tilt<'py>(&self, py: Python<'py>) -> PyResult<Option<Tilt<'py>>> {
        let Some(frame) = &self.tilt else { return Ok(None) };
        // about the ground's z axis (roll) and x axis (pitch), in the order in which a view has them
        let c = frame.covariance;
        let covariance = to_matrix(py, &[[c[(1, 1)], c[(1, 0)]], [c[(0, 1)], c[(0, 0)]]])?;
        Ok(Some((frame.view.tilt.pitch, frame.view.tilt.roll, covariance)))
    }

    /// What there are arrays of.
    #[classattr]
    fn names() -> Vec<&'static str> {
        Outputs::names()
    }

    /// Which of the models each object has, where the call said so.
    #[getter]
    fn model_indices(&self) -> Option<Vec<i64>> {
        self.model_indices.clone()
    }

    /// The array of a field; `None` of another name.
    fn array<'py>(&self, py: Python<'py>, name: &str) -> PyResult<Option<Bound<'py, PyAny>>> {
        let mut outputs = self.locked(py);
        if outputs.is_missing(name) {
            drop(outputs);
            self.make_again(py)?;
            outputs = self.locked(py);
        }
        outputs.array(py, name)
    }

    /// Adds the arrays of all fields that a dictionary does not have.
    fn fill(&self, fields: &Bound<'_, PyDict>) -> PyResult<()> {
        let py = fields.py();
        self.make_again(py)?;
        self.locked(py).fill(fields)
    }
}

impl PyAnswers {
    /// Waits without the GIL, which another thread that holds the lock may want.
    fn locked(&self, py: Python<'_>) -> MutexGuard<'_, Outputs> {
        self.outputs.lock_py_attached(py).unwrap_or_else(PoisonError::into_inner)
    }

    /// What a large batch does not keep. Nobody waits for that: a thread that asks meanwhile makes it too.
    fn make_again(&self, py: Python<'_>) -> PyResult<()> {
        let Some(kept) = self.locked(py).kept(py) else { return Ok(()) };
        let estimator = self.estimator.get();
        let view = self.tilt.as_ref().map_or(&estimator.view, |frame| &frame.view);
        let models = estimator.models.get();
        let rest = models.inputs(self.size.keypoints, self.scores.as_deref(), self.model_indices.as_deref());
        let pool = estimator.pool(self.size.objects)?;
        let made = kept.make(py, rest, |answered, inputs, rows| {
            let said = (&estimator.estimator, view, inputs);
            estimator.spread(py, pool.as_deref(), rows, |workspace, first, rows, go_on| {
                answered.write(said, workspace, first, rows, go_on);
            })
        })?;
        self.locked(py).complete(made);
        Ok(())
    }
}
