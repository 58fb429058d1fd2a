"""The force kinds, each in a file of its own: the list of them all."""

from collections.abc import Mapping

from cutjoint.elements.force import Force
from cutjoint.elements.forces.axial_force import AxialForce as AxialForce
from cutjoint.elements.forces.body_load import BodyLoad as BodyLoad
from cutjoint.elements.forces.bushing import Bushing as Bushing
from cutjoint.elements.forces.contact import Contact as Contact
from cutjoint.elements.forces.joint_force import BallSpring as BallSpring
from cutjoint.elements.forces.joint_force import JointForce as JointForce
from cutjoint.elements.forces.joint_friction import JointFriction as JointFriction
from cutjoint.elements.forces.point_spring import PointSpring as PointSpring
from cutjoint.elements.forces.tyre import Tyre as Tyre
from cutjoint.elements.forces.wheel import Wheel as Wheel

#: The record of each kind by its name, in the order of the schema.
FORCES: Mapping[str, type[Force]] = {
    record.element.kind: record for record in (PointSpring, AxialForce, Bushing, BodyLoad, JointForce, JointFriction, Tyre, Wheel, Contact)
}
