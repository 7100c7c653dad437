"""Force against deflection of the plate (the paper's Fig. 6): measured, simulated, and the slope that was read."""

import math

import numpy as np
import pyqtgraph as pg
from numpy.typing import NDArray
from PySide6.QtCore import QPoint, Qt, Signal, Slot
from PySide6.QtGui import QContextMenuEvent
from PySide6.QtWidgets import QMenu, QWidget

from analysis.quantity import Quantity
from analysis.shot import Shot
from app.plots.time_plot import AXIS_WIDTH
from app.theme import Colours, thin, under

Floats = NDArray[np.float64]


class DeflectionView(pg.GraphicsLayoutWidget):
    """One plot, force in N over deflection in mm; deflection counts from first touch, positive into the plate."""

    export_wanted = Signal(str)

    def __init__(self, colours: Colours, parent: QWidget | None = None) -> None:
        super().__init__(parent)
        self.setAccessibleName("Force against deflection")
        self.setFocusPolicy(Qt.FocusPolicy.StrongFocus)
        self.plot: pg.PlotItem = self.addPlot(enableMenu=False)
        self.plot.hideButtons()
        for side in ("left", "bottom"):
            self.plot.getAxis(side).enableAutoSIPrefix(False)
        self.plot.getAxis("left").setWidth(AXIS_WIDTH)
        self.plot.setLabel("left", "force (N)")
        self.plot.setLabel("bottom", "deflection of the plate from first touch (mm)")
        self.plot.getViewBox().disableAutoRange()
        self._measured = pg.PlotCurveItem(connect="finite")
        self._simulated = pg.PlotCurveItem(connect="finite")
        self._slope = pg.PlotCurveItem()
        for curve in (self._simulated, self._measured, self._slope):
            self.plot.addItem(curve)
        self._bounds = (-0.1, 2.6, -0.1, 0.6)
        self.columns: dict[str, Floats] = {}
        self.dress(colours)

    def dress(self, colours: Colours) -> None:
        """Set the colours."""
        self.setBackground(colours.plot)
        for side in ("left", "bottom"):
            self.plot.getAxis(side).setPen(pg.mkPen(colours.edge))
            self.plot.getAxis(side).setTextPen(pg.mkPen(colours.text))
        self.plot.showGrid(x=True, y=True, alpha=0.18)
        self._measured.setPen(thin(colours.measured))
        self._simulated.setPen(under(colours.simulated))
        self._slope.setPen(thin(colours.residual, Qt.PenStyle.DashLine))

    def show_shot(self, shot: Shot) -> None:
        """Show the contact of this shot."""
        for curve in (self._measured, self._simulated, self._slope):
            curve.setData(np.empty(0), np.empty(0))
        self.columns = {}
        motion, impact = shot.motion, shot.impact
        if motion is None or impact is None or not isinstance(impact.touch_time_s, Quantity):
            return
        touch = impact.touch_time_s.value
        release = impact.release_time_s.value if isinstance(impact.release_time_s, Quantity) else touch + 0.03
        chosen = (motion.time_s > touch - 1e-3) & (motion.time_s < release + 1e-3)
        if not np.any(chosen):
            return
        at_touch = np.interp(touch, motion.time_s, motion.displacement_m)
        deflection = 1e3 * (at_touch - motion.displacement_m[chosen])
        force = motion.force_n[chosen]
        self._measured.setData(deflection, force)
        self.columns = {"deflection_mm": deflection, "force_n": force}
        if shot.fit is not None and shot.fit.shots:
            overlay = shot.fit.shots[0].overlay
            model = 1e3 * (at_touch - overlay.displacement_m[chosen])
            self._simulated.setData(model, overlay.force_n[chosen])
            self.columns |= {"deflection_simulated_mm": model, "force_simulated_n": overlay.force_n[chosen]}
        self._draw_slope(impact.stiffness_slope_n_per_m, deflection, force)
        finite = np.isfinite(deflection) & np.isfinite(force)
        if finite.any():
            x, y = deflection[finite], force[finite]
            spare_x, spare_y = 0.05 * np.ptp(x) + 1e-6, 0.08 * np.ptp(y) + 1e-6
            self._bounds = (x.min() - spare_x, x.max() + spare_x, y.min() - spare_y, y.max() + spare_y)
        self.reset()

    def _draw_slope(self, slope: object, deflection: Floats, force: Floats) -> None:
        if not isinstance(slope, Quantity) or not math.isfinite(slope.value):
            return
        deep = deflection > 0.5 * np.nanmax(deflection)
        middle_x, middle_y = float(np.nanmean(deflection[deep])), float(np.nanmean(force[deep]))
        ends = np.array([0.0, float(np.nanmax(deflection))])
        self._slope.setData(ends, middle_y + 1e-3 * slope.value * (ends - middle_x))

    @Slot()
    def reset(self) -> None:
        """Show the whole contact."""
        left, right, low, high = self._bounds
        self.plot.getViewBox().setRange(xRange=(left, right), yRange=(low, high), padding=0)

    def menu(self) -> QMenu:
        """Return a fresh menu."""
        menu = QMenu(self)
        menu.setAttribute(Qt.WidgetAttribute.WA_DeleteOnClose)
        menu.addAction("Reset the view", self.reset)
        menu.addSeparator()
        menu.addAction("Save as PNG …", self._png)
        menu.addAction("Save as SVG …", self._svg)
        menu.addAction("Save the curves as CSV …", self._csv)
        return menu

    def contextMenuEvent(self, event: QContextMenuEvent) -> None:
        """Open the plot's own menu."""
        self.menu().popup(event.globalPos())
        event.accept()

    def open_menu(self) -> None:
        """Open the menu by key."""
        self.menu().popup(self.mapToGlobal(QPoint(20, 20)))

    @Slot()
    def _png(self) -> None:
        self.export_wanted.emit("png")

    @Slot()
    def _svg(self) -> None:
        self.export_wanted.emit("svg")

    @Slot()
    def _csv(self) -> None:
        self.export_wanted.emit("csv")
