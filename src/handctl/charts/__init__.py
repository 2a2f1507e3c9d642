"""Curves, gait cycles and outlines of hands as SVG, for plots and reports."""
