"""Plan the next shots: those that would separate competing models, or reduce a parameter's uncertainty."""
