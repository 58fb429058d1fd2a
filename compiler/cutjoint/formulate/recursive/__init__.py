"""The fully recursive formulation in relative coordinates: kinematics along the tree, cut joints, elimination from the leaves."""
