"""Plots of the window: decimation without losing a peak, linked time axes, cursors, export."""
