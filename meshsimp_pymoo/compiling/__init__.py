"""How functions become machine code, where it is kept, and who is told of it."""
