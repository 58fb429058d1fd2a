"""Files of other programs as model files: URDF with loops, SDF, MJCF."""
