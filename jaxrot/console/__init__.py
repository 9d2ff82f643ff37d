"""What the commands share: the errors their user can mend, the folder they write, the progress bar."""
