"""What a goal of programs/shutdown_server.py does, by its number of minutes; one of n minutes stops with n bowls."""
(WORKS_ON,  # it does not stop for a minute
 OWN_TEXT,  # it stops with a text of its own
 POLLS,  # it looks once in 10 ms whether it should stop, without a rate
 ONLY_ON_SHUTDOWN,  # it was asked to stop by a client, and does so only during the shutdown
 BY_PREEMPT_CALLBACK,  # it stops when the preempt callback is called
 RAISES,  # it raises when it should stop
 TEN_MORE_PERIODS,  # it goes on for ten periods of 0.05 s when it should stop
 STOPS_ITS_SERVER,  # it stops its server, and works on for a minute
 KEEPS_THE_LOCK,  # it keeps the server's lock for a minute
 RESULT_OF_20_MB,  # it stops when asked to, with a result that takes a while to send
 CALLBACK_BLOCKS,  # it works on, and the preempt callback blocks for a minute
 OF_ITS_OWN_ACCORD) = range(100, 1300, 100)  # it stops; the preempt callback prints that it was called
