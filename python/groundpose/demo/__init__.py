"""`groundpose demo`: a rendered street with known poses, estimated from the image, compared and drawn.

>>> from groundpose.demo import example
>>> street = example()
>>> street.image.shape, street.bboxes.shape[1]
((1080, 1914, 3), 4)
"""

from groundpose.demo.run import Demo, run
from groundpose.demo.street import Street, example

__all__ = ["Demo", "Street", "example", "run"]
