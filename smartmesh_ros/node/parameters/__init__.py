"""The node's parameters: their specifications, declaration, help and files."""
