"""Running times: the report's tables measured again, and on larger maps."""
