"""What every part of the window is made of: colours, labels and buttons, file dialogs, commands and their keys."""
