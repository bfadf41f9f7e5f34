"""Soil: closed forms, a measured wheel, and cost."""
