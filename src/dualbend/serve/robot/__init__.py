"""What an arm of a served cell speaks, a module a protocol."""
