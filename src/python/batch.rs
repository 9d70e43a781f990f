//! `Estimator`: what is the same for many calls, and the calls, with the GIL released.

use std::sync::Mutex;
use std::sync::PoisonError;
use std::sync::atomic::{AtomicBool, Ordering::Relaxed};
use std::time::{Duration, Instant};

use numpy::{PyArray2, PyReadonlyArray1};
use pyo3::prelude::*;
use rayon::ThreadPool;

use super::arrays::flat;
use super::classes::{PyView, to_matrix};
use super::given::Given;
use super::models::PyModels;
use super::observe::Inputs;
use super::options::PyOptions;
use super::outputs::Outputs;
use super::threads::pool;
use crate::estimate::answers::{Answers, Objects};
use crate::estimate::batch::{Batch, OBJECTS_PER_TASK};
use crate::estimate::estimator::Estimator;
use crate::estimate::frame_tilt::FrameTilt;
use crate::estimate::queue::Queue;
use crate::estimate::workspace::Workspaces;
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
    objects: usize,
    modes: usize,
    tilt: Option<FrameTilt>,
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
    #[expect(clippy::too_many_arguments, reason = "everything that a batch can have")]
    fn estimate(
        &self,
        py: Python<'_>,
        keypoints_2d: &Bound<'_, PyAny>,
        bboxes: Option<&Bound<'_, PyAny>>,
        keypoint_scores: Option<&Bound<'_, PyAny>>,
        model_indices: Option<&Bound<'_, PyAny>>,
        vehicle_probability: Option<&Bound<'_, PyAny>>,
        viewing_angle_probabilities: Option<&Bound<'_, PyAny>>,
    ) -> PyResult<Option<PyAnswers>> {
        let rest = (bboxes, keypoint_scores, model_indices, vehicle_probability, viewing_angle_probabilities);
        let Some(given) = Given::new(keypoints_2d, rest) else { return Ok(None) };
        let models = self.models.get();
        let Some(inputs) = given.inputs(models, self.thresholds.as_deref()) else { return Ok(None) };
        let mut outputs = Outputs::new(py, given.objects, inputs.keypoints, models.modes);
        let tilt = {
            let mut writing = outputs.writing(py)?;
            self.run(py, &inputs, given.objects, writing.rows()?)?
        };
        Ok(Some(PyAnswers { objects: given.objects, modes: models.modes, outputs: Mutex::new(outputs), tilt }))
    }
}

impl PyEstimator {
    fn run(
        &self,
        py: Python<'_>,
        inputs: &Inputs,
        objects: usize,
        rows: super::outputs::Rows,
    ) -> PyResult<Option<FrameTilt>> {
        // One thread is the caller's own: no pool, no hand-over.
        let pool = if self.threads == 1 || objects <= OBJECTS_PER_TASK { None } else { Some(pool(self.threads)?) };
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

    /// All answers, with the GIL released but for looks for an interrupt.
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
        py.check_signals()?;
        py.detach(|| {
            let (mut last, mut found) = (Instant::now(), Ok(()));
            let look = || {
                if last.elapsed() >= LOOK {
                    found = Python::attach(|py| py.check_signals());
                    last = Instant::now();
                }
                found.is_ok()
            };
            match pool {
                None => self.workspaces.lend(|workspace| batch.on_this_thread(workspace, 0, answers, look)),
                Some(pool) => self.on_pool(pool, batch, answers, look),
            }
            found
        })
    }

    /// On this thread, which looks whether to go on, and on the others of a pool, which stop when it does.
    fn on_pool<A: Answers>(&self, pool: &ThreadPool, batch: &Batch<Inputs>, answers: A, mut look: impl FnMut() -> bool)
    where
        for<'a> Inputs<'a>: Objects<A>,
    {
        let stopped = AtomicBool::new(false);
        let threads = pool.current_num_threads();
        let queue = Queue::new(0, answers, threads);
        let work = |go_on: &mut dyn FnMut() -> bool| {
            self.workspaces.lend(|workspace| batch.until_empty(workspace, &queue, go_on));
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
        self.objects
    }

    /// Largest number of modes of a model.
    #[getter]
    fn modes(&self) -> usize {
        self.modes
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

    /// The array of a field, the same one whenever it is asked for; `None` of another name.
    fn array<'py>(&self, py: Python<'py>, name: &str) -> PyResult<Option<Bound<'py, PyAny>>> {
        self.outputs.lock().unwrap_or_else(PoisonError::into_inner).array(py, name)
    }
}
