"""Plans of data sets: scenes by name, draws, frames and the tasks that make them."""
