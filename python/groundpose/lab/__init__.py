"""The laboratory: procedural bodies, the virtual drive, training, evaluation and benchmarks.

Nothing here is needed to estimate poses, and nothing that is needed for it imports this.
"""
