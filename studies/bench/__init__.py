"""Running times: the report's tables measured again, on larger maps and for more bodies."""
