"""3×3 algebra on components: matrices, quaternions, exact scaling, small solves. No public names."""
