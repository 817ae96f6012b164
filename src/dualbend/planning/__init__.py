"""At which bending angles the holes of a sheet go over their pins."""
