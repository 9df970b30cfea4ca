"""A two-anchor inchworm: balloons that hold on to the wall in turn, and a body between them that extends."""
