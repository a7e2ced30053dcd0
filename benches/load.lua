-- The script with which `wrk` sends one request repeatedly, for `cargo bench --bench service`.
--
-- Its arguments are the whole HTTP request and the number of requests that were sent before. If the request contains
-- marks (`###`), each request has another number of as many digits in their place. The last line of output contains
-- the number of answers, the time in microseconds, and the number of errors.

-- The difference of successive numbers. It is a prime, so that all numbers occur before one repeats.
local STEP = 7368787

function init(args)
   local before, marks, after = args[1]:match("^([^#]*)(#*)(.*)$")
   local count = 10 ^ #marks
   local format = "%0" .. #marks .. "d"
   local number = args[2] * STEP % count

   function request()
      if marks == "" then return before end
      number = (number + STEP) % count
      return before .. format:format(number) .. after
   end
end

function done(summary)
   local errors = summary.errors
   local failed = errors.connect + errors.read + errors.write + errors.timeout + errors.status
   print(summary.requests, summary.duration, failed)
end
