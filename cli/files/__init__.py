"""Files: pictures, frames, data sets, films, and how they are written."""
