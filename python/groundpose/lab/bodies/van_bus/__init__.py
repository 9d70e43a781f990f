"""Vans and buses: plan, shell, fittings."""
