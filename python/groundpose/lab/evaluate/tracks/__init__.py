"""How well vehicles are followed: sequences with truth, rivals, errors, pages."""
