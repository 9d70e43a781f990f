"""KITTI end to end: `groundpose evaluate kitti`.

A file imports only what stands before it: `overlap`, `average_precision`, `keypoints` (where keypoints come
from), `methods`, `frame` (one frame: estimate, errors, hits), `store` (finished frames on disk), `summary`,
`run`.
"""
