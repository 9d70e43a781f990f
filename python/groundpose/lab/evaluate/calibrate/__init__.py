"""How well a camera is calibrated by the traffic before it: drives on a mast with exact truth."""
