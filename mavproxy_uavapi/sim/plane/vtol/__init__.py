"""What a QuadPlane has beyond a plane: motors that lift it, and the modes that use them."""
