from .light_switch import Edge as Edge
from .light_switch import Level as Level
from .light_switch import LightSwitch as LightSwitch
from .light_switch import TriggerSettings as TriggerSettings
from .light_switch import middle_of_step as middle_of_step
from .motion_trigger import MotionTrigger as MotionTrigger
