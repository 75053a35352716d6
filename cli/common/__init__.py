"""What all commands share: options, models and scenes, the terminal, estimates."""
