"""What the equations need at (q, z): platforms, reduced dynamics, tip kinematics, extended Jacobian."""
