-- The script with which `wrk` sends refused keys, for tests/refused-keys. Its argument is the key. In it, each mark (`#`) becomes a
-- random hexadecimal digit.

function init(args)
   local key = args[1]
   math.randomseed(os.time())

   function request()
      local sent = key:gsub("#", function() return ("%x"):format(math.random(0, 15)) end)
      return wrk.format("GET", "/v1/jobs", {Authorization = "Bearer " .. sent})
   end
end

function done(summary)
   local errors = summary.errors
   print(summary.requests, errors.status, errors.connect + errors.read + errors.write + errors.timeout)
end
