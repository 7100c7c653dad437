from .light_switch import Edge, Level, LightSwitch, TriggerSettings, middle_of_step
from .motion_trigger import MotionTrigger

__all__ = [
    "Edge",
    "Level",
    "LightSwitch",
    "MotionTrigger",
    "TriggerSettings",
    "middle_of_step",
]
