"""From the document's parts to records of bodies, joints, forces and instances."""
