"""URDF files: where they are, what is wrong with them, and how they become one tree of flat joints."""
