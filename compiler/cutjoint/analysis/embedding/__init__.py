"""Loop embedding: closed loops as explicit functions of an independent coordinate."""
