"""The topology stage: spanning tree, cut joints, loops and classes of isomorphic parts."""
