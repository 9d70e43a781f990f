"""How sure the answers are, and whether that is true: of a network on images, of the solver on numbers."""
