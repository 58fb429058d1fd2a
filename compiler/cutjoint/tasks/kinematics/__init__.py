"""Kinematics of an axle: its wheels over travel, roll and steer on a chassis that stands still."""
