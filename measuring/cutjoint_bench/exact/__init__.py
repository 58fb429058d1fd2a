"""Mechanisms whose motion is known in closed form or by quadrature: model files and motions."""
