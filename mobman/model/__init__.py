"""Terms of the equations at (q, z): platforms, reduced dynamics, tip kinematics, extended Jacobian."""
