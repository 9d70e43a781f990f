//! With a workspace that is large enough, an estimate allocates nothing.

mod common;

use common::{Case, Random};
use groundpose::synthetic::{Kind, Protocol};
use groundpose::{Estimator, FixedWorkspace, GrowingWorkspace, Options, Refinement, Solver, Workspace};

/// Allocations of estimating every object once, and the number of answers.
fn allocations(cases: &[Case], options: Options, workspace: &mut impl Workspace) -> (u64, usize) {
    let estimator = Estimator::new(options).unwrap();
    let mut answers = 0;
    let mut count = 0;
    for case in cases {
        case.with_observation(|observation| {
            let info = allocation_counter::measure(|| {
                answers += usize::from(estimator.estimate(&case.view, observation, workspace).is_ok());
            });
            count += info.count_total;
        });
    }
    (count, answers)
}

fn cases(modes: usize) -> Vec<Case> {
    let protocol = Protocol { kind: Kind::Vehicle, ..Protocol::default() };
    let case = |trial: u64| {
        let mut case = Case::of(&protocol, &protocol.scene(2, trial));
        let mut random = Random(trial);
        let count = case.keypoints_2d.len();
        case.basis = (0..modes * count).map(|_| random.point([[-0.05; 3], [0.05; 3]])).collect();
        case.eigenvalues = vec![1.0; modes];
        case.scores = trial.is_multiple_of(2).then(|| (0..count).map(|_| random.between(0.2, 1.0)).collect());
        case
    };
    (0..20).map(case).collect()
}

#[test]
fn a_warm_estimate_allocates_nothing() {
    for modes in [0, 3, 10] {
        let cases = cases(modes);
        let mut growing = GrowingWorkspace::new();
        let (cold, _) = allocations(&cases, Options::default(), &mut growing);
        assert!(cold > 0, "the counter counts");
        for solver in [Solver::Auto, Solver::P3p, Solver::Up2p] {
            for refinement in [Refinement::Default, Refinement::Hre, Refinement::Re, Refinement::Gn, Refinement::None] {
                let options = Options { solver, refinement, max_iterations: 200, ..Options::default() };
                let (warm, answers) = allocations(&cases, options, &mut growing);
                assert_eq!(warm, 0, "{modes} modes, {solver:?}, {refinement:?}");
                assert!(answers >= 10, "{modes} modes, {solver:?}, {refinement:?}: {answers}");
                let (fixed, _) = allocations(&cases, options, &mut FixedWorkspace::<32>::new());
                assert_eq!(fixed, 0, "{modes} modes, {solver:?}, {refinement:?}");
            }
        }
    }
}
