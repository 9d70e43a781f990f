"""Pickups: plan, shell, fittings."""
