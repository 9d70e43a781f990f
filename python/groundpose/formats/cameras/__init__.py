"""Readers of other tools' camera files. `groundpose.formats.calibrations` has the table of them."""
