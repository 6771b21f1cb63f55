"""Serial and tree arms of any shape: joints, links, recursions, URDF and DH tables."""
