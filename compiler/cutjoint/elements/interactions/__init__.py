"""The interactions, each in a file of its own."""

from cutjoint.elements.interactions.attitude_force import AttitudeForce as AttitudeForce
from cutjoint.elements.interactions.axis_force import AxisForce as AxisForce
from cutjoint.elements.interactions.compliance import Compliance as Compliance
from cutjoint.elements.interactions.line_force import LineForce as LineForce
from cutjoint.elements.interactions.on_coordinate import CoordinateFriction as CoordinateFriction
from cutjoint.elements.interactions.on_coordinate import OnCoordinate as OnCoordinate
from cutjoint.elements.interactions.road_contact import RoadContact as RoadContact
from cutjoint.elements.interactions.rolling_contact import RollingContact as RollingContact
from cutjoint.elements.interactions.touch import Touch as Touch
from cutjoint.elements.interactions.wrench import Wrench as Wrench
