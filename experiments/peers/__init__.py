"""Other programs that do what wamnet does: each is imported by one module, and only when it is measured."""
