"""Plots of the window: decimation that keeps all peaks, linked time axes, cursors, export."""
