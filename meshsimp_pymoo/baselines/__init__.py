"""Other ways to simplify a mesh, to compare the evolution with: each takes a mesh and gives meshes."""
