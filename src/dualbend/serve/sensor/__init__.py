"""What a wrist sensor of a served cell speaks, a module a protocol."""
