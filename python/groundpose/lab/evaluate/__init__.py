"""Measuring: metrics, least-squares oracles, other libraries, synthetic and real experiments.

Nothing here is needed to estimate poses. A file imports only what stands before it: `metrics`, `scenes`,
`real_data`, `oracle`, `methods`, `rivals`, `rows`, `timing`, `report`; rows of the table of bars are in
`guarantee`, `accuracy`, `honesty`, `cost`. The programs: `real` (real keypoints), `bars` (what the solver
must show), `kitti` and `apollo` (folders of real data, `tilt`: ways
to tell the tilt; `html`, `real_page`: their pages).
"""
