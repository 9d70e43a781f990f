"""The laboratory: procedural bodies, the virtual drive, training, evaluation and benchmarks.

Nothing here is needed to estimate poses, and nothing that is needed for it imports this. Imports go one way:
`metrics`, `timing`, `targets` and `data` import none of the others; `bodies`, `drive`, `training`;
`contenders`; `evaluate`, which uses all of those; `bench`.
"""
