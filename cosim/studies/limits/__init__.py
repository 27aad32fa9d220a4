"""What is achievable, and which limit of the circuit binds."""
