"""Parts of a page and the ways to show them: text, console, HTML, JUnit."""
